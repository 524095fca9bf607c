"""Campaigns: runs of requirements x methods x seeds, resumable.

::

    request = CampaignRequest(runs=cross(problems, ["surrogate"], seeds=range(10), budget=Budget(1500)))
    run_campaign(request, Path("runs/nightly"), jobs=4)

A campaign is a directory with one run directory per run. These run directories are the only record of what is
finished, so a campaign that was killed can be resumed from them.
"""

from falsifier.campaigns.archcomp import suite as suite
from falsifier.campaigns.directory import is_worked_on as is_worked_on
from falsifier.campaigns.progress import Follower as Follower, Progress as Progress
from falsifier.campaigns.request import (
    CampaignRequest as CampaignRequest,
    Method as Method,
    cross as cross,
    method_of as method_of,
    run_name as run_name,
)
from falsifier.campaigns.runner import (
    CampaignEnd as CampaignEnd,
    resume_campaign as resume_campaign,
    run_campaign as run_campaign,
)
from falsifier.campaigns.runs import RunProgress as RunProgress
