"""A tree without its questions: which frame hangs on which, its numbers, its states, and what compiles them."""
