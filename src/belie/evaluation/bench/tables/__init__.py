"""The tables of a suite, a file for what belongs together; `belie.evaluation.bench.summary` chooses among them."""
