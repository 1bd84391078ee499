mod plant;
mod port;
mod replay;
