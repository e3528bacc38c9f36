-- Finished games are listed in the order in which their ends were committed: a cursor into the list misses none that ends late.

-- Number in the list, from 1; NULL for a game that is not in it.
ALTER TABLE games ADD COLUMN listed INTEGER;
UPDATE games SET listed = number WHERE summary IS NOT NULL;
CREATE UNIQUE INDEX games_listed ON games (listed) WHERE listed IS NOT NULL;
