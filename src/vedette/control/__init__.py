"""Where to send the sensors next: actions, ideal measurements, rewards, joint action search, planners."""
