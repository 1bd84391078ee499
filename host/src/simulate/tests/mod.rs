mod plant;
mod replay;
