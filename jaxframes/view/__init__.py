"""Pictures of trees: graph text."""
