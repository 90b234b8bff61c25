"""Rayscope's window and command line."""
