"""A scene as plain C."""
