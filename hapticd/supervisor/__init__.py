"""The supervisor process: starts and watches the loop's process, publishes what it records, talks to systemd."""
