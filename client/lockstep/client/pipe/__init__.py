"""A console for programs in another Python: `python -m lockstep.client.pipe` takes requests on its standard input.

LeRobot pins older packages than the client needs, so its plugins start this process and speak to it in the frames of
`lockstep.protocol.pipe.pipe_frames`. The process ends, and with it the driving, when its input does, or the process
that started it, whose number may be its argument.
"""
