"""What the shipped cases of one mechanism share: geometry, closed forms, claims and limits."""
