# What there is: make demo, make test, make test-full, make docs, make bench, make images,
# make clean.
# All they need is python3 (3.11 or later) with its venv module; the rest goes to .venv.

VENV := .venv
PYTHON := $(VENV)/bin/python
TESTED := gtval validation survey vision_gt laser_gt rtk_gt data_samples tests benchmarks docs examples

# One thread a process: the tests run side by side, and small matrices gain nothing from more.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: demo test test-full check-code check-wheel docs bench images clean

demo: $(VENV)/installed
	$(VENV)/bin/gtval demo

test: check-code check-wheel
	$(PYTHON) -m pytest -n 2 -m "not full"

test-full: check-code check-wheel
	$(PYTHON) -m pytest -n 2

check-code: $(VENV)/installed-for-tests
	$(PYTHON) -m ruff check $(TESTED)
	$(PYTHON) -m ruff format --check $(TESTED)
	$(PYTHON) -m mypy
	$(VENV)/bin/lint-imports --no-cache

# What users get is the wheel: the demo must run from it, far from this folder.
check-wheel: $(VENV)/installed-for-tests
	.ci/check-wheel $(PYTHON)

# Warnings are errors, and a name that leads nowhere is a warning. The tests build it, too.
docs: $(VENV)/installed-for-docs
	$(PYTHON) -m sphinx -W -n --keep-going -q -b html docs build/docs
	@echo "The site: build/docs/index.html"

bench: $(VENV)/installed-for-tests
	for question in benchmarks/*.py; do $(PYTHON) $$question || exit 1; done

images: $(VENV)/installed
	$(PYTHON) docs/make_images.py
	$(PYTHON) docs/make_survey_images.py
	$(PYTHON) docs/make_explain_images.py
	$(PYTHON) docs/make_room_pictures.py
	$(PYTHON) docs/make_tutorial_images.py

clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

# Installed editable, so that the commands always run the sources as they are.
$(VENV)/installed: pyproject.toml | $(VENV)/bin/python
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/installed-for-tests: pyproject.toml | $(VENV)/bin/python
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@ $(VENV)/installed

$(VENV)/installed-for-docs: pyproject.toml | $(VENV)/bin/python
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@ $(VENV)/installed

$(VENV)/bin/python:
	python3 -m venv $(VENV)
