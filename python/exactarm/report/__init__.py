"""What a person sees: a report of sections, as terminal text, as one HTML file and as plots."""

from exactarm.report.sections import (
    Cell,
    Estimate,
    Figure,
    Highlight,
    Highlights,
    Link,
    Quantity,
    Report,
    Section,
    Table,
    Text,
    Warnings,
)

__all__ = ["Cell", "Estimate", "Figure", "Highlight", "Highlights", "Link", "Quantity", "Report",
           "Section", "Table", "Text", "Warnings"]
