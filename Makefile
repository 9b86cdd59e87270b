# Everything, on a machine with Python ≥ 3.11, make and a C++20 compiler. See CONTRIBUTING.md.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Where compiled files are forbidden, every process would compile the package and the tests anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo install test lint types contracts docs bench tables sanitize sanitized wheel web web-check clean

demo: $(VENV)/.demo
	$(BIN)/asterism demo --out demo --overwrite

# Each core takes files that follow each other, which share what they simulate, and in the end what
# others still have.
test: $(VENV)/.test
	$(BIN)/python -m pytest -n auto --dist worksteal --doctest-modules --doctest-continue-on-failure

lint: $(VENV)/.lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/codespell --dictionary tests/tools/retired_words.txt

types: $(VENV)/.lint
	$(BIN)/pyright

contracts: $(VENV)/.lint
	$(BIN)/lint-imports

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict # --quiet would hide broken links from --strict

bench: $(VENV)/.bench
	$(BIN)/python benchmarks/speed.py --markdown docs/tables/speed.md
	$(BIN)/python benchmarks/dense.py --markdown docs/tables/dense.md
	$(BIN)/python benchmarks/cameras.py --markdown docs/tables/cameras.md
	$(BIN)/python benchmarks/smooth.py --markdown docs/tables/smooth.md
	$(BIN)/python benchmarks/smooth.py --lengths 500 1000 2000 4000 8000 \
	  --markdown docs/tables/whole_captures.md
	$(BIN)/python benchmarks/stream.py --markdown docs/tables/stream.md
	$(BIN)/python benchmarks/stream.py --flat --frames 1000000 --markdown docs/tables/stream_flat.md
	$(BIN)/python benchmarks/live.py --method gnn --markdown docs/tables/live_latency.md
	$(BIN)/python benchmarks/live.py --day --rate 100 --markdown docs/tables/live_day.md
	$(BIN)/python benchmarks/joint.py --markdown docs/tables/joint.md
	$(BIN)/python benchmarks/k_best.py --markdown docs/tables/k_best.md
	$(BIN)/python benchmarks/threads.py --markdown docs/tables/threads.md
	$(BIN)/python benchmarks/large.py --markdown docs/tables/large.md \
	  --figure docs/images/large_growth.svg

# The tables of scenes and of captures in the docs; the second needs the real captures beside the
# project.
tables: $(VENV)/.bench
	$(BIN)/asterism reproduce --overwrite --out build/reproduction
	for part in build/reproduction/parts/*.md build/reproduction/times.md; do \
	  cp $$part docs/tables/report_$$(basename $$part); done
	cp build/reproduction/images/*.svg docs/images
	$(BIN)/python benchmarks/crossing.py --markdown docs/tables/crossing.md \
	  --figure docs/images/reliability.png
	$(BIN)/python benchmarks/windows.py --markdown docs/tables/windows.md
	$(BIN)/python benchmarks/several_frames.py --markdown docs/tables/several_frames.md
	$(BIN)/python benchmarks/scenes.py --seeds 5 --markdown docs/tables/scenes.md
	$(BIN)/python benchmarks/captures.py --markdown docs/tables/captures.md
	$(BIN)/python benchmarks/batch.py --markdown docs/tables/batch.md
	$(BIN)/python benchmarks/whole_call.py --markdown docs/tables/whole_call.md
	$(BIN)/python benchmarks/identity.py --markdown docs/tables/identity.md
	$(BIN)/python benchmarks/calibration.py --seeds 6 --markdown docs/tables/calibration.md
	$(BIN)/python benchmarks/identity_methods.py --markdown docs/tables/identity_methods.md
	$(BIN)/python benchmarks/places.py --markdown docs/tables/places.md
	$(BIN)/python benchmarks/correction.py --markdown docs/tables/correction.md
	$(BIN)/python benchmarks/field.py --markdown docs/tables --figure docs/images/field_growth.svg
	$(BIN)/python benchmarks/fills.py --markdown docs/tables/fills.md
	$(BIN)/python benchmarks/names.py --markdown docs/tables/names.md
	$(BIN)/python benchmarks/bodies.py --markdown docs/tables/bodies.md
	$(BIN)/python benchmarks/reconstruction.py --markdown docs/tables/reconstruction.md
	$(BIN)/python benchmarks/estimation.py --markdown docs/tables/estimation.md
	$(BIN)/python benchmarks/tuned.py --markdown docs/tables/tuned.md

# The engine under the address and undefined-behaviour sanitizers, with asserts on. It is built
# beside the package and never installed.
sanitize: sanitized $(VENV)/.test
	build/sanitize/engine_checks
	$(BIN)/python tests/tools/run_sanitized.py build/sanitize

sanitized: $(VENV)/.python
	PATH="$(CURDIR)/$(BIN):$$PATH" cmake -S . -B build/sanitize -G Ninja \
	  -DASTERISM_SANITIZE=ON -DASTERISM_WERROR=ON -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python \
	  -Dnanobind_DIR="$$($(BIN)/python -m nanobind --cmake_dir)"
	PATH="$(CURDIR)/$(BIN):$$PATH" cmake --build build/sanitize

# From the tree, where the engine is built already; and what is built from is all in the archive of
# sources.
wheel: $(VENV)/.python
	$(BIN)/python -m pip install --quiet build
	rm -rf dist
	$(BIN)/python -m build --no-isolation --sdist --wheel --outdir dist
	tar -tzf dist/*.tar.gz | sed 's,^[^/]*/,,' | LC_ALL=C sort > build/in_sources
	git ls-files CMakeLists.txt LICENSE README.md pyproject.toml engine src | LC_ALL=C sort \
	  | LC_ALL=C comm -23 - build/in_sources > build/missing
	@test ! -s build/missing || { echo "not in the archive of sources:"; cat build/missing; exit 1; }

# The player of the report page, from its sources in web/ into the package. Needs Node.js ≥ 20; who
# only uses or builds the package needs none, because the bundle is committed.
web: web/node_modules/.made
	cd web && node build.js

web-check: web/node_modules/.made
	cd web && node build.js --check

web/node_modules/.made: web/package.json web/package-lock.json
	@command -v npm > /dev/null || { \
	  echo "npm is missing: install Node.js 20 or newer (Debian: apt-get install nodejs npm)"; exit 1; }
	cd web && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error
	touch $@

clean:
	rm -rf $(VENV) build dist site demo web/node_modules

# One stamp for each set of extras; a newer pyproject.toml or engine installs again. What builds the
# engine is in the environment: an isolated build would find it in another place each time and
# compile everything again.
SOURCES := pyproject.toml CMakeLists.txt $(shell find engine -type f)
INSTALL := $(BIN)/python -m pip install --quiet --no-build-isolation --check-build-dependencies -e

$(VENV)/.python:
	$(PYTHON) -c 'import sys; sys.exit("asterism needs Python 3.11 or newer: set PYTHON=python3.x") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet cmake nanobind ninja scikit-build-core
	touch $@

$(VENV)/.demo: $(VENV)/.python $(SOURCES)
	$(INSTALL) .
	touch $@

$(VENV)/.%: $(VENV)/.python $(SOURCES)
	$(INSTALL) '.[$*]'
	touch $@

# What the checks need, at once: quicker than each by itself.
CHECKS := demo test lint docs
install: $(VENV)/.python
	$(INSTALL) '.[test,lint,docs]'
	touch $(CHECKS:%=$(VENV)/.%)
