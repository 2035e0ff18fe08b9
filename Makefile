# Everyday commands. `make help` lists them.

CARGO ?= cargo
DEMO ?= demo
# Tests that lack their measured data, or a program, append themselves to this file.
SKIPPED := $(CURDIR)/target/skipped-tests
# Tests compare with OpenCV; the demo, whose board has dots, does not need it.
OPENCV := depthcal-detect/opencv

.PHONY: help setup test demo check recordings python bench

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## */  make \1	/' | expand -t 16

setup: ## install what is missing on this machine (OpenCV, libclang)
	@./scripts/setup.sh

test: setup ## install what is missing and run all tests
	@mkdir -p $(dir $(SKIPPED)) && : > $(SKIPPED)
	@status=0; DEPTHCAL_SKIPPED=$(SKIPPED) $(CARGO) test --workspace --features $(OPENCV) || status=$$?; \
		sort $(SKIPPED); echo "$$(wc -l < $(SKIPPED)) tests SKIPPED"; exit $$status

demo: ## calibrate simulated captures; ends in demo/report.html
	$(CARGO) run --release --no-default-features --features cli -- demo --out $(DEMO)

check: setup ## formatting, clippy and rustdoc without warnings, and the build without OpenCV
	$(CARGO) fmt --all --check
	rustfmt --check --edition 2024 $(wildcard crates/model/src/*/*.rs) # pieces: files that a macro declares
	$(CARGO) clippy --workspace --all-targets --features $(OPENCV) -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps
	$(CARGO) check --no-default-features
	$(CARGO) check --no-default-features --features cli

recordings: setup ## clippy and tests of --rrd, which brings some 230 more crates
	$(CARGO) clippy -p depthcal-report --all-targets --features rerun -- -D warnings
	$(CARGO) test -p depthcal-report --features rerun --lib rerun::

python: ## build the wheel of the Python package and run its tests in a fresh environment
	@./scripts/python-tests.sh

bench: setup ## run the benchmarks
	$(CARGO) bench -p depthcal-benches
