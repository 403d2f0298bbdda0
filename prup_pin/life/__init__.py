"""Many tests: one device followed over its life, many devices of one drawing compared."""
