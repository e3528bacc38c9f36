-- What a node said with its last heartbeat that is wrong: how many of the others it does not reach, and whether nothing that it writes
-- is committed. Nodes of earlier versions say nothing.
ALTER TABLE nodes
    ADD COLUMN unreachable integer NOT NULL DEFAULT 0,
    ADD COLUMN stalled boolean NOT NULL DEFAULT false;
