"""Makes the pictures of docs/reports.md: the report, the watch page, and a figure of each analysis.

python docs/scripts/report_pictures.py

It needs a Chromium, which ``CHROMIUM`` names or which is on the path.
"""

import asyncio
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from threading import Thread

from falsifier import (
    Budget,
    CampaignRequest,
    ProblemSource,
    analysis,
    coverage,
    cross,
    evaluate,
    falsify,
    load_problem,
    plotting,
    robustness_map,
    run_campaign,
)
from falsifier.views.report import html_report
from falsifier.views.report.watch import serve

PICTURES = Path(__file__).resolve().parents[1] / "pictures"
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
WIDTH = 1000


def photograph(address: str, name: str, height: int, profile: Path) -> None:
    """Take a picture of a page."""
    subprocess.run(
        [
            str(CHROMIUM),
            *("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"),
            f"--user-data-dir={profile}",
            f"--window-size={WIDTH},{height}",
            "--virtual-time-budget=5000",
            f"--screenshot={PICTURES / name}",
            address,
        ],
        check=True,
        capture_output=True,
    )


def photograph_watch_page(directory: Path, name: str, height: int, profile: Path) -> None:
    """Serve the watch page of a directory, and take a picture of it."""
    loop = asyncio.new_event_loop()

    async def work() -> None:
        told: asyncio.Queue[str] = asyncio.Queue()
        server = asyncio.create_task(serve(directory, announce=told.put_nowait))
        address = await told.get()
        await asyncio.to_thread(photograph, address, name, height, profile)
        server.cancel()

    thread = Thread(target=loop.run_until_complete, args=(work(),))
    thread.start()
    thread.join()


def main() -> None:
    """Search a few bundled requirements and draw everything."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        place, profile = Path(folder), Path(folder) / "profile"
        run = ["falsifier", "run", "AT6a", "--budget", "300", "--seed", "1", "--quiet"]
        subprocess.run([*run, "--out", "gearbox"], cwd=place, check=False, capture_output=True)
        for more in (["--shrink"], []):
            subprocess.run(
                ["falsifier", "explain", "gearbox", *more], cwd=place, check=True, capture_output=True
            )
        report = place / "report.html"
        report.write_text(html_report(place / "gearbox"), encoding="utf-8")
        photograph(report.as_uri(), "report.png", 1500, profile)

        miss = falsify("CC4", "uniform", budget=60, seed=1, directory=place / "cars")
        photograph_watch_page(place / "cars", "watch.png", 2100, profile)
        plotting.save_figure(
            plotting.plot_coverage(coverage(place / "cars"), "CC4"), PICTURES / "coverage.png"
        )
        assert miss.best is not None
        plotting.save_figure(plotting.plot(miss), PICTURES / "nearest-miss.png")

        problem = load_problem("AT1")
        found = falsify(problem, budget=60, seed=1).shown
        assert found is not None
        around = robustness_map(problem, evaluate(problem, found.candidate))
        plotting.save_figure(plotting.plot_robustness_map(around, "AT1"), PICTURES / "robustness-map.png")

        runs = cross(
            [ProblemSource(target=name, parameterization="fixed") for name in ("AT1", "AT6a", "CC3")],
            ("uniform", "corners", "surrogate"),
            seeds=range(5),
            budget=Budget(60),
        )
        run_campaign(CampaignRequest(runs=runs), place / "campaign")
        loaded = analysis.load(place / "campaign")
        plotting.save_figure(plotting.plot_comparison(loaded), PICTURES / "comparison.png")
        plotting.save_figure(plotting.plot_rates(loaded), PICTURES / "rates.png")


if __name__ == "__main__":
    main()
