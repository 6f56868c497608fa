//! Latest-value cells and rings between threads, MCAP recording and replay: all wire types
