//! The token with which gimbals are controlled over HTTP: a secret word in a file that nobody else can read.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::hint::black_box;
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;

use nix::fcntl::OFlag;
use nix::unistd::geteuid;

/// Shorter ones could be guessed, longer ones are no token.
const LENGTH: std::ops::RangeInclusive<usize> = 16..=256;

/// Whoever knows it may ask things of gimbals.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// Why a file holds no token that can be used.
#[derive(Debug, thiserror::Error)]
pub enum TokenError {
    #[error("cannot be read: {0}")]
    Unreadable(#[source] io::Error),
    #[error("is no regular file")]
    NoFile,
    #[error("has mode {0:04o}, so that others can read or change it")]
    Open(u32),
    #[error("belongs to user {0}, neither to the one who reads it nor to root")]
    Foreign(u32),
    #[error("is empty")]
    Empty,
    #[error("does not hold one word of 16 to 256 printable ASCII characters")]
    Malformed,
}

impl Token {
    /// What a file must be, for people.
    pub const EXPECTED: &'static str = "a file with one word of 16 to 256 characters that only the user who runs gimbald \
        can read: openssl rand -hex 32, chown gimbald, chmod 0600";

    /// Reads the token of the daemon: nobody but its own user, or root, may have access to the file.
    pub fn read_guarded(path: &Path) -> Result<Self, TokenError> {
        let file = open(path)?;
        let metadata = file.metadata().map_err(TokenError::Unreadable)?;
        let (mode, reader) = (metadata.permissions().mode() & 0o7777, geteuid());
        if mode & 0o077 != 0 {
            return Err(TokenError::Open(mode));
        }
        // Root can read what belongs to anybody, and is asked to check it.
        if metadata.uid() != reader.as_raw() && metadata.uid() != 0 && !reader.is_root() {
            return Err(TokenError::Foreign(metadata.uid()));
        }
        Self::read_from(file)
    }

    /// Reads the token of somebody who asks the daemon; whom he lets read it is his affair.
    pub fn read(path: &Path) -> Result<Self, TokenError> {
        Self::read_from(open(path)?)
    }

    fn read_from(file: File) -> Result<Self, TokenError> {
        let mut text = Vec::new();
        // A little more than the longest, with the end of its line, shows that it is too long.
        file.take(*LENGTH.end() as u64 + 16).read_to_end(&mut text).map_err(TokenError::Unreadable)?;
        let text = text.trim_ascii_end();
        if text.is_empty() {
            return Err(TokenError::Empty);
        }
        let text = std::str::from_utf8(text).map_err(|_| TokenError::Malformed)?;
        text.parse()
    }

    /// A word that nobody can guess.
    pub fn random() -> io::Result<Self> {
        let mut bytes = [0; 16];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Writes it where nothing is yet, for its owner only.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
        writeln!(file, "{}", self.0)
    }

    /// Whether `given` is this token. How long it takes does not depend on how much of it is right.
    pub fn is(&self, given: &[u8]) -> bool {
        let own = self.0.as_bytes();
        let differing = given
            .iter()
            .enumerate()
            .fold(0, |differing, (at, byte)| differing | (black_box(own[at % own.len()]) ^ byte));
        (black_box(differing) == 0) & (given.len() == own.len())
    }

    /// For the header of a request, and nothing else.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl std::str::FromStr for Token {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        let is_word = text.bytes().all(|byte| byte.is_ascii_graphic());
        if is_word && LENGTH.contains(&text.len()) { Ok(Self(text.to_owned())) } else { Err(TokenError::Malformed) }
    }
}

/// It never gets into a log.
impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

fn open(path: &Path) -> Result<File, TokenError> {
    // A FIFO would wait for a writer.
    let file = OpenOptions::new().read(true).custom_flags(OFlag::O_NONBLOCK.bits()).open(path);
    let file = file.map_err(TokenError::Unreadable)?;
    if file.metadata().map_err(TokenError::Unreadable)?.is_file() { Ok(file) } else { Err(TokenError::NoFile) }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};

    use super::*;

    #[test]
    #[rustfmt::skip]
    fn only_a_guarded_word_is_a_token() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("token");
        let long = "x".repeat(256);
        for (content,                       mode,  expected) in [
            ("0123456789abcdef\n",          0o600, "ok"),
            ("0123456789abcdef\r\n",        0o400, "ok"),
            (long.as_str(),                 0o600, "ok"),
            ("",                            0o600, "is empty"),
            (" \n\n",                       0o600, "is empty"),
            ("0123456789abcde\n",           0o600, "does not hold one word of 16 to 256 printable ASCII characters"),
            ("0123456789abcdef 0\n",        0o600, "does not hold one word of 16 to 256 printable ASCII characters"),
            ("0123456789abcdef\nsecond",    0o600, "does not hold one word of 16 to 256 printable ASCII characters"),
            ("0123456789äbcdef",            0o600, "does not hold one word of 16 to 256 printable ASCII characters"),
            (&format!("{long}x"),           0o600, "does not hold one word of 16 to 256 printable ASCII characters"),
            (&long.repeat(100),             0o600, "does not hold one word of 16 to 256 printable ASCII characters"),
            ("0123456789abcdef",            0o640, "has mode 0640, so that others can read or change it"),
            ("0123456789abcdef",            0o604, "has mode 0604, so that others can read or change it"),
            ("0123456789abcdef",            0o620, "has mode 0620, so that others can read or change it"),
        ] {
            fs::write(&path, content).expect("a writable folder");
            fs::set_permissions(&path, Permissions::from_mode(mode)).expect("our own file");
            let read = Token::read_guarded(&path).map_or_else(|error| error.to_string(), |_| "ok".to_owned());
            assert_eq!(read, expected, "{content:?}");
            fs::remove_file(&path).expect("our own file");
        }
        assert_eq!(Token::read_guarded(folder.path()).expect_err("a directory").to_string(), "is no regular file");
        let error = Token::read_guarded(&path).expect_err("it was removed").to_string();
        assert!(error.starts_with("cannot be read: No such file"), "{error}");
        nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRUSR).expect("a writable folder");
        assert_eq!(Token::read_guarded(&path).expect_err("a FIFO").to_string(), "is no regular file");
    }

    #[test]
    fn a_random_token_is_written_for_its_owner_only() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("token");
        let token = Token::random().expect("random bytes");
        token.write(&path).expect("a writable folder");
        assert_eq!(Token::read_guarded(&path).expect("it is guarded"), token);
        assert_ne!(Token::random().expect("random bytes"), token);
        assert!(token.write(&path).is_err(), "what is there stays");
    }

    #[test]
    fn a_token_is_itself_and_nothing_else() {
        let token: Token = "0123456789abcdef".parse().expect("long enough");
        for (given, expected) in [
            ("0123456789abcdef", true),
            ("0123456789abcdeF", false),
            ("1123456789abcdef", false),
            ("0123456789abcde", false),
            ("0123456789abcdef0123456789abcdef", false),
            ("", false),
        ] {
            assert_eq!(token.is(given.as_bytes()), expected, "{given}");
        }
        assert_eq!(format!("{token:?}"), "Token(…)");
    }
}
