//! Whole-system tests over real sockets: what a participant, a spectator or a stranger can do to a server, and what it makes of it.

mod answers;
mod beginnings;
mod branches;
mod connections;
mod cup;
mod doors;
mod examiner;
mod faults;
mod languages;
mod lists;
mod played;
mod records;
mod restarts;
mod rooms;
mod spectators;
mod stops;
mod stranger;
mod terminal;
mod tmux;
mod tournament_agents;
mod tournament_deals;
mod tournament_refusals;
mod tournaments;
mod vector_columns;
mod vectors;
mod web;
