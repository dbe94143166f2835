"""Messages to vehicle states, intents to messages: one class per autopilot family."""
