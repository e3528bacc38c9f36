-- `journal` in partitions of 262,144 games each, in the order in which those were created. journal_N ends before game number
-- N * 262,144. Nodes add partitions before they are needed, and drop those without games.
DO $$
DECLARE
    partitions bigint := (SELECT regexp_replace(pg_get_constraintdef(oid), '\D', '', 'g')::bigint / 262144
                          FROM pg_constraint WHERE conname = 'journal_before' AND conrelid = 'journal'::regclass);
    first text := 'journal_' || partitions;
BEGIN
    EXECUTE format('ALTER TABLE journal RENAME TO %I', first);
    EXECUTE format('ALTER INDEX journal_pkey RENAME TO %I', first || '_pkey');
    CREATE TABLE journal (
        game bigint NOT NULL,
        -- From 0, without gaps.
        position bigint NOT NULL,
        -- The epoch of its writer.
        epoch bigint NOT NULL,
        entries bytea NOT NULL,
        PRIMARY KEY (game, position)
    ) PARTITION BY RANGE (game);
    EXECUTE format('ALTER TABLE journal ATTACH PARTITION %I FOR VALUES FROM (MINVALUE) TO (%s)', first, partitions * 262144);
    EXECUTE format('ALTER TABLE %I DROP CONSTRAINT journal_before', first);
    -- Nodes of the earlier version add none.
    FOR before IN partitions .. partitions + 3 LOOP
        EXECUTE format('CREATE TABLE %I PARTITION OF journal FOR VALUES FROM (%s) TO (%s)', 'journal_' || before + 1,
                       before * 262144, (before + 1) * 262144);
    END LOOP;
END $$;
