"""The service: settings, models, errors to HTTP, routes and commands of a few lines each."""
