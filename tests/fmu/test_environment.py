from falsifier.fmu.environment import worker_environment


def test_everything_is_passed_on_but_secrets() -> None:
    given = {"PATH": "/usr/bin", "LM_LICENSE_FILE": "27000@licenses", "OPENAI_API_KEY": "x"}
    seen = worker_environment(given)
    assert (seen["PATH"], seen["LM_LICENSE_FILE"]) == ("/usr/bin", "27000@licenses")
    assert "OPENAI_API_KEY" not in seen
    assert given == {"PATH": "/usr/bin", "LM_LICENSE_FILE": "27000@licenses", "OPENAI_API_KEY": "x"}


def test_each_process_computes_in_one_thread() -> None:
    threads = [name for name in worker_environment({"OMP_NUM_THREADS": "8"}) if name.endswith("_NUM_THREADS")]
    assert len(threads) >= 3
    assert {worker_environment({"OMP_NUM_THREADS": "8"})[name] for name in threads} == {"1"}
