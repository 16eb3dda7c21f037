"""The four-bar's routes and commands: match, synthesize, export."""
