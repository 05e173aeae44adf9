"""Feature trackers: where each says that a feature is. They see images and know no sequence."""
