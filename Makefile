# make run    set up and run the main job: the bouncing ball on every engine, judged, with a report
# make test   set up and pass the tests
# make strict the main job, failing too where a number left its regression band; make bands stores the bands anew
# make scripts  store by what pages are drawn, once a browser has been asked
# make faults plant faults in a copy of the sources and see whether runs and tests fail (JOBS=2: two at a time)
# make speed  measure the tables of docs/explanation/speed.md anew, about twenty minutes on a machine that does nothing else
# make walkers  measure the tables of walking robots in docs/explanation/contacts.md and the README anew, some minutes
# make docs   build the pages into build/docs; a broken link is an error
PYTHON ?= $(firstword $(shell command -v python3.11 python3.12 python3.13 python3 2>/dev/null))
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: run test slow bench peers faults strict bands scripts check docs wheel-check picture speed walkers format clean

run: $(READY)
	$(BIN)/crossbody run --out out

test: $(READY)
	$(BIN)/pytest -m "not slow and not bench" -n auto --dist loadfile

slow: $(READY)
	$(BIN)/pytest -m slow

bench: $(READY)
	$(BIN)/pytest -m bench
	$(BIN)/crossbody bench --out out/bench

peers: $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[peers]'
	$(BIN)/pytest tests/engines/test_peers.py tests/engines/test_drake_scenes.py tests/reports/test_bench.py tests/engines/test_engine_contract.py -m "not bench"

JOBS ?= 1
faults: $(READY)
	$(BIN)/python tests/support/plant_faults.py --jobs $(JOBS)

strict: $(READY)
	$(BIN)/crossbody run --strict --out build/strict

scripts: $(READY)
	$(BIN)/pytest -q $(shell ls tests/reports/test_page_*.py) && $(BIN)/python -m crossbody.reports.pages.known_scripts
bands: $(READY)
	$(BIN)/python -m crossbody.reports.commands.bands

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

wheel-check:
	PYTHON=$(PYTHON) .ci/wheel-check

speed: $(READY)
	$(BIN)/python docs/speed.py

walkers: $(READY)
	$(BIN)/python docs/walkers.py

picture: $(READY)
	$(BIN)/python docs/picture.py

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

$(VENV)/.docs: $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

$(READY): pyproject.toml setup.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "crossbody needs Python 3.11 or newer; name one with make PYTHON=python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	$(BIN)/python -m pip install --quiet --no-deps axe-playwright-python # for its axe.min.js alone; needs no playwright
	touch $(READY)

clean:
	rm -rf $(VENV) out build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
