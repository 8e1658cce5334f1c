"""A report of one run for people: was it stable, what did the law add, what did the machine do."""
