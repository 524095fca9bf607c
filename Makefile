# The main targets are `make demo` and `make test`. Both install what they need in this folder.

# The first Python on this machine that is recent enough.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin
PIP_INSTALL := install --quiet --disable-pip-version-check --no-compile

# Set, as in many container images, it would have every process compile all modules that it imports: litellm takes 12 s
# of processor time instead of 6, and most others three to five times as long.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test lint types types-linux types-darwin pytest docs notebooks fmus worker clean

# `falsifier run` exits with 1 if it falsified the requirement, which is what the demo expects.
demo: .venv/installed
	@$(BIN)/falsifier run AT1 --out runs/demo-$$(date +%Y%m%d-%H%M%S); test $$? -eq 1

# Two cores share what comes before the tests, as the tests then do.
test:
	+$(MAKE) --no-print-directory --jobs=2 --output-sync=target .venv/test .venv-export/installed types lint
	+$(MAKE) --no-print-directory pytest

lint: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: types-linux types-darwin

types-linux: .venv/test
	$(BIN)/mypy

# Only these modules can differ between systems: all that import what not all systems have in full, and those that
# ask which system it is.
types-darwin: .venv/test
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/darwin --follow-imports silent \
		$$(grep -rlE 'sys\.platform|posix|^ *(import|from) (os|signal|socket|subprocess|ctypes)\b' \
			--include='*.py' falsifier)

pytest: .venv/test .venv-export/installed
	$(BIN)/pytest -n 2 --dist worksteal

docs: .venv/test
	$(BIN)/mkdocs build --strict

# Executes the notebooks and stores their outputs; the tests only execute them.
notebooks: .venv/test
	$(BIN)/python -m tests.notebooks

# Rebuilds every FMU in fmus/ from modelica/. The exporter has its own environment, because pymoca and rtamt need
# different versions of the antlr runtime.
fmus: .venv-export/installed
	$(MAKE) -C modelica PYTHON=$(CURDIR)/.venv-export/bin/python fmus

# Rebuilds the programs that run FMUs, if their sources have changed.
worker: .venv-export/installed
	$(MAKE) -C falsifier/fmu/worker ZIG="'$(CURDIR)/.venv-export/bin/python' -m ziglang"

# Either of these two is enough. pip compiles no modules: most are never imported, and the others then compile.
.venv/installed: pyproject.toml constraints.txt | .venv/bin/pip
	$(BIN)/pip $(PIP_INSTALL) -c constraints.txt -e .
	@touch $@

.venv/test: pyproject.toml constraints.txt | .venv/bin/pip
	$(BIN)/pip $(PIP_INSTALL) -c constraints.txt -e '.[test]'
	@touch .venv/installed $@

# Without a pip of its own, which takes seconds to set up.
.venv-export/installed: modelica/export/requirements.txt | .venv/bin/pip
	$(PYTHON) -m venv --without-pip .venv-export
	$(BIN)/pip --python .venv-export/bin/python $(PIP_INSTALL) -r modelica/export/requirements.txt
	@touch $@

.venv/bin/pip:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer with venv is required; install it, or run make PYTHON=/path/to/python3"; exit 2; }
	$(PYTHON) -m venv .venv

clean:
	rm -rf .venv .venv-export build .mypy_cache .ruff_cache .pytest_cache .hypothesis runs
