mod fixtures;
mod traced;
