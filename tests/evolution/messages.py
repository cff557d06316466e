"""What a march says, for tests whose bodies are so soft that their strains are large."""

from __future__ import annotations

from hemivar.evolution import History

__all__ = ["said_of"]


def said_of(history: History) -> tuple[str, ...]:
    """The messages of a march, without that its strains are large."""
    return tuple(message for message in history.messages if not message.startswith("beyond small strains"))
