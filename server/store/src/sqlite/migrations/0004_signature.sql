-- Finished games are signed by the server's key.

-- The signature of a hosted game's record, and what it depends on besides header and journal (folder form/); NULL if it has none.
ALTER TABLE games ADD COLUMN signature BLOB;
