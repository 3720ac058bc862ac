"""Quality control: the frame rate, picture size and bitrate that each tier of peers gets."""
