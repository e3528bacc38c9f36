-- The rooms that wait or play at a node, as it said with its last heartbeat: what a new room is created by and what is handed
-- over depends on it. Nodes of earlier versions say nothing.
ALTER TABLE nodes ADD COLUMN rooms bigint;
