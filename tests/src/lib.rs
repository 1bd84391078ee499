//! Helpers of the stories: the `host` binary run as a process, scratch folders, the shared data folder.
