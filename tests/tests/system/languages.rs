//! The main job: a game of four processes in three languages, against the binary.

