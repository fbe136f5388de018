"""What the project's speed claims rest on; see docs/benchmarks.md, which `make bench` writes."""
