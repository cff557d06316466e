"""Laws, bodies and tasks together: each works and agrees with a second way, or is refused in a sentence."""
