//! Several server processes as the nodes of a cluster, on a real PostgreSQL server and behind a real
//! proxy, while machines and networks fail.

mod alerts;
mod balance;
mod certificates;
mod cluster;
mod creating;
mod cup;
mod cuts;
mod failover;
mod faults;
mod growth;
mod joining;
mod measure;
mod proxy;
mod rounds;
mod studies;
