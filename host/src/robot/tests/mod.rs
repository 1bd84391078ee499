mod chain;
mod description;
mod doggy;
