"""The computation: along a path and over all frames, on a tree's structure, numbers and state."""
