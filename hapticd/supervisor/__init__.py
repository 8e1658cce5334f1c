"""The supervisor process: starts and watches the control process, publishes what it records, talks to systemd."""
