-- Reads all journals, while nodes write to them.
ALTER TABLE journal VALIDATE CONSTRAINT journal_before;
