"""What people see and keep of the telemetry: recordings, reports, a page in the browser, other tools' formats."""
