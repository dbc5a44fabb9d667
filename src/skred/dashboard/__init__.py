"""The dashboard: results of several runs in one page, served or written as one offline file."""
