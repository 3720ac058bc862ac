"""Control of the robot: seat, command arbiter, stops, speed cap, participants."""
