"""What a report says of throws in particular."""
