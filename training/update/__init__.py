"""Training a part of a finished scene anew from the photos of a later visit."""
