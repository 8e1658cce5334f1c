"""Many random devices under every law: who settles, who does not, and why."""
