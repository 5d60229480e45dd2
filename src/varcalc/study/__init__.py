"""Problems with known answers, methods held against each other and against closed forms, speed against accuracy."""
