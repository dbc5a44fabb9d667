"""What was studied once: the reproduction, Ryggfonn, thresholds, masked effects, the record of the proof."""
