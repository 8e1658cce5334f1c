"""What subscribers see: wire format, endpoints, the publisher. The contract is docs/telemetry.md."""
