mod chain;
mod description;
mod doggy;
mod urdf;
