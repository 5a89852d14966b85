"""The smallest table that meets a goal: by uniform records or by bisection, as the layout says."""

from collections.abc import Sequence
from fractions import Fraction

from jaxframes.spice.fitting.bisection import by_size, by_tolerance
from jaxframes.spice.fitting.candidates import Choice, Model, Part
from jaxframes.spice.fitting.goal import Goal
from jaxframes.spice.fitting.uniform import uniform


def smallest(model: Model, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice:
    """Return the records to use: the smallest that meet the goal's errors, or the best of its size.

    Args:
        model: What is fitted.
        parts: Spans of time that are fitted by themselves.
        unit: Length of the kernel's own records; those tried are this times powers of two.
        goal: What is asked of them.

    Raises:
        ToleranceError: If no records do.
    """
    if goal.layout == "uniform":
        return uniform(model, parts, unit, goal)
    return by_size(model, parts, unit, goal) if goal.free else by_tolerance(model, parts, unit, goal)
