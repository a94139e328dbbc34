"""The figures of a report, one file each; only here is matplotlib imported."""

from observer.report.figures.arrows import ARROWS
from observer.report.figures.base import Columns, Drawing, Flights, style
from observer.report.figures.distance import DISTANCE
from observer.report.figures.hand_motion import HAND_MOTION
from observer.report.figures.reaction import REACTION
from observer.report.figures.timeline import TIMELINE
from observer.report.figures.top_view import TOP_VIEW
from observer.report.figures.tracking import TRACKING

FIGURES = (HAND_MOTION, TRACKING, ARROWS, DISTANCE, TOP_VIEW, TIMELINE, REACTION)
"""Every figure, in the order of the report."""

__all__ = ["FIGURES", "Columns", "Drawing", "Flights", "style"]
