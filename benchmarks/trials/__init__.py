"""Trials that benchmarks and tests share: made drives, pairs of scans, typing errors, a peer."""
