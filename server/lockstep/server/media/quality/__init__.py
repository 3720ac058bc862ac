"""Quality: how many pictures of which size and bitrate each tier of peers gets."""
