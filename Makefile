# `make gait` runs the main job, `make walk` simulates the walker, `make test` runs all checks but
# what is left to `make nightly`, `make check` the quick ones, `make docs` builds the documentation site.
# Each sets up what it needs in .venv inside this checkout; repeated runs do not set up again.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
OUT := out/walk
# A file's tests share compiled programs; files begin in the order of tests/conftest.py.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# What `make figures` runs, at full size: all, or those named by `make figures ONLY="ladder"`.
EXPERIMENTS := $(filter-out _% quote,$(patsubst experiments/%.py,%,$(wildcard experiments/*.py)))
ONLY ?= $(EXPERIMENTS)

# Which of the nightly tests `make nightly` runs: I/N, of N parts the one of that number; I,J/N: two.
SHARE := 0/1

.PHONY: walk gait check test nightly mutants unit landing lint types docs dist notebooks figures clean

walk: $(VENV)/.installed
	$(BIN)/jaxbiped walk --out $(OUT)
	@echo "Pictures, animation and trajectory: $(OUT)"

gait: $(VENV)/.installed
	$(BIN)/jaxbiped gait --out out/gait

# Lint, types and the unit tests; docs/testing.md says which tests these are. What takes a core alone
# for half a minute, types, goes beside the tests.
check: lint
	$(MAKE) --no-print-directory --jobs 2 types unit

test: lint
	$(MAKE) --no-print-directory --jobs 2 types landing

unit: $(VENV)/.installed-dev
	$(PYTEST) -m "not slow"

landing: $(VENV)/.installed-dev
	$(PYTEST) -m "not nightly"

# Experiments, notebooks, the site: all of them, or by `make nightly SHARE=3/6` a part;
# each landing runs two sixths, by the time of day (`python -m tests.nightly`).
nightly: $(VENV)/.installed-dev
	$(PYTEST) --nightly-share=$(SHARE)

# Breaks the package in one place at a time: tests must fail each time (docs/testing.md). All that are
# listed, or those whose names begin like `make mutants ONLY="saltation bars-divided"`; or so many as
# are drawn by `make mutants DRAW=300 SEED=7` from the whole package, in a run that can be stopped.
mutants: ONLY :=
DRAW :=
SEED := 0
mutants: $(VENV)/.installed-dev
	$(BIN)/python -m tests.mutants $(if $(DRAW),--draw $(DRAW) --seed $(SEED),--jobs 2) $(ONLY)

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy

# The documentation site in out/site; EXECUTE=force runs the lessons first.
docs: $(VENV)/.installed-dev
	$(BIN)/sphinx-build -W --keep-going -q -j 2 -c docs . out/site
	@echo "The site: out/site/index.html"

# The wheel and the source distribution, the same to the last byte for the same commit.
dist: $(VENV)/.installed-dev
	rm -rf dist
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m build --outdir dist .

# Runs all notebooks at full size and keeps them with their outputs; takes some minutes.
notebooks: $(VENV)/.installed-dev
	$(BIN)/python notebooks/execute.py

# Runs experiments at full size, one after the other, and keeps their numbers in experiments/results;
# what the pages quote of these is printed at the end. Timings want an idle machine: on another,
# UNTIMED=--untimed leaves them out.
figures: $(VENV)/.installed-dev
	mkdir -p out/figures
	for name in $(ONLY); do \
		$(BIN)/python experiments/$$name.py --out out/figures --json out/figures/$$name.json \
			&& $(BIN)/python experiments/quote.py --keep out/figures/$$name.json $(UNTIMED) \
			|| exit 1; \
	done
	$(BIN)/python experiments/quote.py

$(VENV)/.made:
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11), "jaxbiped needs Python 3.11 or newer"'
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/.installed: $(VENV)/.made pyproject.toml
	$(PIP) --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.made pyproject.toml
	$(PIP) --editable '.[dev]'
	touch $@ $(VENV)/.installed

clean:
	rm -rf $(VENV) out
