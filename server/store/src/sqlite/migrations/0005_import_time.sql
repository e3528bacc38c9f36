-- How long an imported game is kept counts from its import: ended_at_ms of an imported game is the time of the import.

-- The time of earlier imports is unknown; they count from now.
UPDATE games SET ended_at_ms = 1000 * CAST(strftime('%s', 'now') AS INTEGER) WHERE added = 1;
