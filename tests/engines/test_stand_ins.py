from falsifier.engines.stand_ins import StandIns
from falsifier.evaluation.evaluate import Evaluation
from falsifier.testing import lag_problem


def test_only_simulated_candidates_count_each_for_its_source() -> None:
    space = lag_problem().space
    candidates = [space.decode([0.1 * i] * 4) for i in range(5)]
    noted = StandIns()
    noted.because("the engine 'corners'", "the server is gone")
    noted.because("the engine 'corners'", "a later reason")
    noted.proposed("the engine 'corners'", candidates[1:])
    assert noted.remarks([]) == ()
    simulated = [Evaluation(c, "failed", reason="x") for c in candidates[:3]]
    assert noted.remarks(simulated) == (
        "2 of 3 samples from the engine 'corners', because the server is gone",
    )


def test_a_long_reason_is_cut() -> None:
    noted = StandIns()
    candidate = lag_problem().space.decode([0.1] * 4)
    noted.because("chance", "word " * 200)
    noted.proposed("chance", [candidate])
    (remark,) = noted.remarks([Evaluation(candidate, "failed", reason="x")])
    assert len(remark) < 300 and remark.endswith(" ...")
