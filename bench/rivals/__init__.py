"""What others build, reduced to what is compared: pictures of the same robot bridge, sent the way they send them."""
