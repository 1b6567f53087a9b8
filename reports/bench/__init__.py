"""Run time against error: ladders, orders, headline ratios, what is skipped, throughput."""
