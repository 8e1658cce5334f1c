"""The command line of the views, one thin module a group."""
