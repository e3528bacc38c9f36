-- Finished games that retention has deleted: what is left of them are their journals, which follow later, most of them with
-- a whole partition of `journal` (migration 7).
CREATE TABLE pruned (
    -- The number that it had in `games`.
    game bigint PRIMARY KEY,
    at_ms bigint NOT NULL
);

-- The table of journals becomes the first partition, for the numbers of games up to this one: those that exist, and a quarter
-- of a million more for the nodes that create games until migration 7 has run. Nobody reads the table for it while it is locked
-- (migration 6 does).
DO $$
DECLARE
    partitions bigint := (SELECT CASE WHEN is_called THEN last_value / 262144 + 2 ELSE 1 END FROM games_number_seq);
BEGIN
    EXECUTE format('ALTER TABLE journal ADD CONSTRAINT journal_before CHECK (game < %s) NOT VALID', partitions * 262144);
END $$;
